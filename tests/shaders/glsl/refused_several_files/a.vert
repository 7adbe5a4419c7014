#version 330
#error in the vertex stage
void main() { }
