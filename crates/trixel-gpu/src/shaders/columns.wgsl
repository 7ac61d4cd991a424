// A share of the columns of one triangle, one after the other.

fn voxelize_columns(t: Triangle, first: u32) {
    let rect = column_rect(t.base, t.extent, t.flags & AXIS_MASK);
    let width = u32(rect.z - rect.x + 1);
    let columns = rect_columns(rect);
    let last = min(columns, first + params.max_columns);
    if first >= last {
        return;
    }
    var a = rect.x + i32(first % width);
    var b = rect.y + i32(first / width);
    for (var i = first; i < last; i++) {
        _ = voxelize_column(t, a, b);
        a++;
        if a > rect.z {
            a = rect.x;
            b++;
        }
    }
}

