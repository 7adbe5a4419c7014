#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { int data[]; };
int calls;
bool touch(inout int c) { c += 1; return c > 3; }
bool next() { calls++; return calls < 9; }
bool pure(int a) { return a > 2; }
bool through() { return next(); }
void main() {
    int n = data[0];
    int c = 0;
    if (n > 0 && touch(c)) data[1] = c;
    if (n > 0 && pure(n)) data[2] = c;
    bool a = n > 1 || through() && n < 7 || touch(c);
    while (n < 10 && next()) n++;
    for (int i = 0; i < 4 || touch(c); i++) data[i] = int(a);
    if ((n > 3 ^^ next()) && (n++ < 5)) data[3] = n;
    data[4] = (n > 2 && touch(c)) ? 1 : 2;
    if (n == 1) data[5] = 1; else a = a && next();
    do { n--; } while (n > 0 && next());
}
