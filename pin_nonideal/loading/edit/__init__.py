"""Edits of a model: other joint types, locked or fixed joints, another base placement."""
