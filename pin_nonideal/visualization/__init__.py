"""Plots, pictures, videos and replay pages."""
