"""From descriptions to the core's program: names become indices, user functions checked ones."""
