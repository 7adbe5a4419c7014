#version 450
layout(location = 0) out vec4 colour;

#include "missing/none.glsl"
#include <also_missing.glsl>
#include "lib/broken.inc.glsl"
#include nothing
#defin X 1
#define X 1
#define X 2
#if 1 +
#endif
#if 1 / 0
#endif
#elif 1
#else
#endif
#define F(a, b) a
float x = F(1);
#error this shader wants a newer Kiln
#extension GL_EXT_buffer_reference : require
#extension GL_KHR_shader_subgroup_basic : enable
#extension GL_ARB_shading_language_420pak : require
#extension GL_SOME_vendor_thing : enable
#extension GL_ARB_gpu_shader5 : maybe
#version 123
#ifdef NEVER_CLOSED
