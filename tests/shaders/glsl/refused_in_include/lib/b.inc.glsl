float shade(float x)
{
    float doubled = x * 2.0;
    return dubled;
}
