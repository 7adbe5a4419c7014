float local() { return 1.0; }
