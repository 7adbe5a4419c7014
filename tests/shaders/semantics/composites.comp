#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `grid[1][2] = grid[0][1];` => `grid[1][2] = grid[1][1];`
struct Inner { ivec2 pair; float list[3]; };
struct Outer { Inner inner; int count; Inner more[2]; };
Inner make(int a) { return Inner(ivec2(a, -a), float[3](float(a), 2.0, 3.0)); }
int sum(Inner one) { one.pair.x += 1; return one.pair.x + int(one.list[0]); }
int total(int rows[2][3]) { int s = 0; for (int i = 0; i < 2; i++) for (int j = 0; j < rows[i].length(); j++) s = s * 3 + rows[i][j]; return s; }
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int a = ints[base];
    Inner one = make(a), two = one;
    two.pair.y = ints[base + 1];
    Outer outer;
    outer.inner = two; outer.count = 4; outer.more[0] = one; outer.more[1] = make(a + 1);
    Outer copy = outer;
    copy.more[a & 1].list[2] = 9.0;
    int grid[2][3] = int[2][3](int[3](1, a, 3), int[3](4, 5, 6));
    grid[1][2] = grid[0][1];
    grid[a & 1][1] += 10;
    int rows[2][3] = grid;
    rows[0] = rows[1];
    ints[base] = sum(one) + sum(outer.more[1]) * 100;
    ints[base + 1] = int(one == two) + 2 * int(two != make(a)) + 4 * int(outer == copy) + 8 * int(outer.inner == two);
    ints[base + 2] = total(grid); ints[base + 3] = total(rows);
    ints[base + 4] = int(grid == rows) + 2 * int(grid[1] == rows[0]) + 4 * int(grid[0] != int[3](1, a, 3));
    ints[base + 5] = one.pair.x + copy.more[1].pair.y * 3 + outer.count + grid.length() * 100 + grid[0].length() * 10;
    floats[base] = copy.more[0].list[2] + outer.more[0].list[2] * 2.0 + copy.more[1].list[2] * 4.0;
    { int one = 5; ints[base + 6] = int(one == a) + one; }
}
