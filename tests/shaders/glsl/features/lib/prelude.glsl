#version 300 es
float shared_scale() { return 2.0; }
