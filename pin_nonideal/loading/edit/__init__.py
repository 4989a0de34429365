"""Changes to a model: joints exchanged, locked or fixed, another base."""
