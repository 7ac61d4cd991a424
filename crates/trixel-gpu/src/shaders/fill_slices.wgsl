// Solids from the boundary voxels of slices: [CL] 2.3, as `trixel::fill` defines them. One invocation a column.

struct Fill {
    nx: u32,
    ny: u32,
    nz: u32,
    column_words: u32,
    // Of `correct_xor`: which pass this is, from 1 on.
    pass_number: u32,
}

@group(0) @binding(0) var<uniform> volume: Fill;
@group(0) @binding(1) var<storage, read> boundary: array<u32>;
@group(0) @binding(2) var<storage, read_write> filled: array<u32>;
// A word a column: since which pass it is good, 0 from the start.
@group(0) @binding(3) var<storage, read_write> good_since: array<atomic<u32>>;

const QUESTIONABLE: u32 = 0xffffffffu;

// Inside from each boundary voxel to the next in one word; `carry` is all ones where the word below ended inside.
fn switched(word: u32, carry: u32) -> u32 {
    var parity = word;
    parity ^= parity << 1u;
    parity ^= parity << 2u;
    parity ^= parity << 4u;
    parity ^= parity << 8u;
    parity ^= parity << 16u;
    return parity ^ carry;
}

fn carried(parity: u32) -> u32 {
    return select(0u, 0xffffffffu, (parity >> 31u) == 1u);
}

// The lowest so many bits.
fn below(bits: u32) -> u32 {
    return select((1u << (bits & 31u)) - 1u, 0xffffffffu, bits >= 32u);
}

// The bits of word i that are in the grid.
fn inside_grid(i: u32) -> u32 {
    return below(volume.nz - min(32u * i, volume.nz));
}

// Neighbour i of eight of a column, or QUESTIONABLE beyond the grid.
fn neighbour(column: u32, i: u32) -> u32 {
    let place = select(i, i + 1u, i >= 4u);
    let x = i32(column / volume.ny) + i32(place / 3u) - 1;
    let y = i32(column % volume.ny) + i32(place % 3u) - 1;
    if x < 0 || y < 0 || x >= i32(volume.nx) || y >= i32(volume.ny) {
        return QUESTIONABLE;
    }
    return u32(x) * volume.ny + u32(y);
}

// Good columns are filled, questionable ones keep their boundary; UNCORRECTED (prepended) fills all.
@compute @workgroup_size(WORKGROUP)
fn switch_columns(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let column = invocation(group, groups, local);
    if column >= volume.nx * volume.ny {
        return;
    }
    let start = column * volume.column_words;
    var odd = 0u;
    for (var i = 0u; i < volume.column_words; i++) {
        odd ^= countOneBits(boundary[start + i]) & 1u;
    }
    let fill = UNCORRECTED || odd == 0u;
    var carry = 0u;
    for (var i = 0u; i < volume.column_words; i++) {
        let word = boundary[start + i];
        let parity = switched(word, carry);
        carry = carried(parity);
        filled[start + i] = select(word, parity & inside_grid(i), fill);
    }
    atomicStore(&good_since[column], select(0u, QUESTIONABLE, odd == 1u));
}

// A questionable column takes what most of the good ones around it have; where as many say one as the other, its own
// switching decides.
@compute @workgroup_size(WORKGROUP)
fn correct_xor(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let column = invocation(group, groups, local);
    if column >= volume.nx * volume.ny || atomicLoad(&good_since[column]) != QUESTIONABLE {
        return;
    }
    var voters: array<u32, 8>;
    var count = 0u;
    for (var i = 0u; i < 8u; i++) {
        let other = neighbour(column, i);
        // Those corrected in this very pass are not asked, whether they are through or not.
        if other != QUESTIONABLE && atomicLoad(&good_since[other]) < volume.pass_number {
            voters[count] = other;
            count++;
        }
    }
    if count == 0u {
        return;
    }
    let start = column * volume.column_words;
    var carry = 0u;
    for (var i = 0u; i < volume.column_words; i++) {
        let own = switched(boundary[start + i], carry);
        carry = carried(own);
        // The votes of 32 voxels at once, as binary numbers with a digit in each of four words.
        var votes = vec4<u32>(0u);
        for (var k = 0u; k < count; k++) {
            var add = filled[voters[k] * volume.column_words + i];
            for (var digit = 0u; digit < 4u; digit++) {
                let sum = votes[digit] ^ add;
                add &= votes[digit];
                votes[digit] = sum;
            }
        }
        // More than half, or half: compared digit by digit from the highest.
        var more = 0u;
        var equal = 0xffffffffu;
        for (var digit = 4u; digit > 0u; digit--) {
            let half = select(0u, 0xffffffffu, ((count / 2u) >> (digit - 1u) & 1u) == 1u);
            more |= equal & votes[digit - 1u] & ~half;
            equal &= ~(votes[digit - 1u] ^ half);
        }
        let tie = select(equal, 0u, count % 2u == 1u);
        filled[start + i] = (more | (tie & own)) & inside_grid(i);
    }
    atomicStore(&good_since[column], volume.pass_number);
}

// The first boundary voxel of a column, or QUESTIONABLE.
fn first_of(column: u32) -> u32 {
    for (var i = 0u; i < volume.column_words; i++) {
        let word = boundary[column * volume.column_words + i];
        if word != 0u {
            return 32u * i + firstTrailingBit(word);
        }
    }
    return QUESTIONABLE;
}

fn mean(sum: u32, count: u32) -> u32 {
    return (2u * sum + count) / (2u * count);
}

// Figure 3's low-pass filter: a questionable column is as thick as the good ones around it in the mean, and begins where
// these do in the mean.
@compute @workgroup_size(WORKGROUP)
fn correct_march(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let column = invocation(group, groups, local);
    if column >= volume.nx * volume.ny || atomicLoad(&good_since[column]) != QUESTIONABLE {
        return;
    }
    var sum = 0u;
    var count = 0u;
    var firsts = 0u;
    var entered = 0u;
    for (var k = 0u; k < 8u; k++) {
        let other = neighbour(column, k);
        if other != QUESTIONABLE && atomicLoad(&good_since[other]) == 0u {
            for (var i = 0u; i < volume.column_words; i++) {
                sum += countOneBits(filled[other * volume.column_words + i]);
            }
            count++;
            let first = first_of(other);
            if first != QUESTIONABLE {
                firsts += first;
                entered++;
            }
        }
    }
    if count == 0u {
        return;
    }
    let start = column * volume.column_words;
    var first = first_of(column);
    if entered > 0u {
        first = mean(firsts, entered);
    }
    let end = min(first + mean(sum, count), volume.nz);
    for (var i = 0u; i < volume.column_words; i++) {
        let at = 32u * i;
        filled[start + i] = below(end - min(at, end)) & ~below(first - min(at, first));
    }
    // Not 0: its neighbours go on asking good columns alone.
    atomicStore(&good_since[column], 1u);
}
