"""Weather of a fire: hourly tables, and fuel moistures computed from them."""
