"""Results of joint tests on a bench: read from their files, computed, compared; without Qt."""
