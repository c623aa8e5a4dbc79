"""Pure mathematics: arrays in, arrays out. Knows no robot, no scenario and no particular solver."""
