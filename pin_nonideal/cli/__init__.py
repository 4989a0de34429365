"""The command `pin-nonideal`."""
