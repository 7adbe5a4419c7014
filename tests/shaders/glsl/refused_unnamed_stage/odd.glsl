#pragma shader_stage(pixel)
void main() {}
