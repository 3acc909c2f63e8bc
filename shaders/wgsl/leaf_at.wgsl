// Grid coordinates of a place in units (`core::seeds::place`).
fn grid_of_place(place: vec2<u32>) -> vec2<u32> {
    let apart = place - view.grid_place;
    if view.root_level >= 5u {
        return apart << vec2<u32>(view.root_level - 5u);
    }
    return apart >> vec2<u32>(5u - view.root_level);
}

// Index of the leaf at grid coordinates, or EMPTY.
fn leaf_index_at(unit: vec2<u32>) -> u32 {
    var entry = root_entry(unit);
    if entry == EMPTY {
        return EMPTY;
    }
    entry = nodes[entry];
    for (var depth = 0u; depth < ROOT_BITS; depth++) {
        if (entry & LEAF_BIT) != 0u {
            break;
        }
        let quadrant = (unit >> vec2<u32>(ROOT_BITS - 1u - depth)) & vec2<u32>(1u);
        entry = nodes[entry + 2u * quadrant.y + quadrant.x];
    }
    if entry == EMPTY || (entry & LEAF_BIT) == 0u || leaves[entry & ~LEAF_BIT].slot == EMPTY {
        return EMPTY;
    }
    return entry & ~LEAF_BIT;
}
