"""The command line `pin-nonideal`."""
