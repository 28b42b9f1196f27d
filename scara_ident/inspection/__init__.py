"""What is in a log: columns, quantities, units and joints."""
