vec4 sheen() { return vec4(FEATURE_SHEEN); }
