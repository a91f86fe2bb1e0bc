"""The noise-free experiments of the paper, and gains for a scenario: no wire and no estimator."""
