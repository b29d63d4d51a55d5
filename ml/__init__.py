"""Windows, features, training, evaluation and prediction of the robot's status."""
