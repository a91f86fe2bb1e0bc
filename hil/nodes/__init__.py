"""The pure steps of estimator and controller, and the lockstep that runs them."""
