"""Agencies: whose land is whose, and whom vehicles serve."""
