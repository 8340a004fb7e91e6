"""Design studies: many variants of one machine, solved in parallel, in one table."""
