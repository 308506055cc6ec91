"""The CAD catalogue: importers, meshes, surface samples and the class map."""
