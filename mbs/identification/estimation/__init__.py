"""Methods that find parameters from equations, how sure these are, and what they leave."""
