"""Pictures and rays: the only room that imports OpenGL, Embree and a JPEG library, when they are used."""
