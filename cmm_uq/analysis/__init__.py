"""What a recording says: screening, diagnosis, conformity, planning and the parts that a machine measures."""
