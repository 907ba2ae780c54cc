"""How fast surface fires spread: Rothermel's model and the Canadian one, in metres and minutes."""
