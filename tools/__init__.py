"""Tools for the repository: generators of the reference, pictures, and measurements of a store."""
