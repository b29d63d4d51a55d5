"""The wire: JSON-RPC 2.0, one UTF-8 message a line; what each method takes and gives."""
