"""The weather that a fire burns in: tables by the hour, and the moisture of fuels that follows from them."""
