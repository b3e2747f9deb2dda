"""Design motion profiles that leave no sway, and prove it."""
