"""The study of convex bodies and meshes beside coal."""
