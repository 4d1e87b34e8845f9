// SPDX-License-Identifier: Apache-2.0
// Where the rays of all pixels are, between two dispatches.
layout(set = 0, binding = 22, std430) buffer MarchStates {
    vec4 march_states[];
};

MarchState load_march(uint index) {
    vec4 state = march_states[index];
    return MarchState(state.x, state.y, state.z, state.w);
}

void store_march(uint index, MarchState state) {
    march_states[index] = vec4(state.distance, state.extinction, state.way, state.margin);
}
