"""robot.yaml: loops, laws, contacts and initial states of a robot."""
