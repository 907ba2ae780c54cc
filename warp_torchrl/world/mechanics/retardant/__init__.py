"""Aircraft that drop retardant."""
