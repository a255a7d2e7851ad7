"""MGeo maps: the files of a folder -> roads, traffic lights, and a list of mistakes."""
