"""What others bring: laws and estimators of their own, found by reference and held to a digest."""
