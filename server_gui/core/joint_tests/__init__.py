"""What tests of a joint on a bench have measured: read from their files, computed, compared; without Qt."""
