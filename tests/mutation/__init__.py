"""Mutation tests: what protects people is changed in one place at a time, and some test must notice."""
