"""The desk side: server core, views, application."""
