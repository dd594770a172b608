"""The equations that a record gives, and how well they show the parameters."""
