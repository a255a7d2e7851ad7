"""The simulator on the bus: it joins the world, the scene, synchronous mode and all topics and services."""
