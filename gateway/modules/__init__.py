"""The paper's robot modules: resource, component, control, status."""
