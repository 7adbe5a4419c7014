#version 330
layout(triangles) in;
void main() { EmitVertex(); }
