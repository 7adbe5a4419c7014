#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
int at;
int counts[4];
int first = counts[at++]++;
void main() { data[0] = float(first); }
