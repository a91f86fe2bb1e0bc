"""The pure steps of estimator and controller."""
