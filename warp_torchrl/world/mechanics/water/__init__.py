"""Water: where vehicles fill their tanks."""
