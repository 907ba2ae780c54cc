"""Fires alone in metres and minutes: predicted, mapped and told in numbers."""
