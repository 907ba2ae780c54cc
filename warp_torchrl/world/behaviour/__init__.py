"""Rates of spread of surface fires: Rothermel's model and the Canadian one, in metres and minutes."""
