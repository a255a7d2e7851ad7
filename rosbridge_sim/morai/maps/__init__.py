"""MGeo maps: the files of a folder -> roads, lights and what is wrong with them."""
