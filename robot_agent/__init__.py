"""The robot agent: one process per robot, from its sources to identified sightings on the wire."""
