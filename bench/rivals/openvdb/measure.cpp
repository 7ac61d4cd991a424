// Measures OpenVDB's meshToVolume on a prepared case: measure FOLDER SECONDS THREADS; prints one JSON object. Voxels whose
// centre has a negative distance are inside.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/global_control.h>

using Clock = std::chrono::steady_clock;

static double ms(Clock::time_point from) {
    return std::chrono::duration<double, std::milli>(Clock::now() - from).count();
}

static std::string text(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

template <class T>
static std::vector<T> values(const std::string& path) {
    const std::string bytes = text(path);
    std::vector<T> out(bytes.size() / sizeof(T));
    std::copy_n(bytes.data(), out.size() * sizeof(T), reinterpret_cast<char*>(out.data()));
    return out;
}

// The number, or the numbers in brackets, after a name.
static std::vector<long> numbers(const std::string& json, const std::string& name) {
    const size_t at = json.find("\"" + name + "\":");
    std::string rest = json.substr(at + name.size() + 3);
    rest = rest.substr(0, rest[0] == '[' ? rest.find(']') : rest.find_first_of(",}"));
    std::replace_if(rest.begin(), rest.end(), [](char c) { return c < '0' || c > '9'; }, ' ');
    std::istringstream words(rest);
    return {std::istream_iterator<long>(words), {}};
}

static long status_bytes(const std::string& name) {
    const std::string status = text("/proc/self/status");
    return std::stol(status.substr(status.find(name) + name.size())) * 1024;
}

static void print(const std::vector<double>& numbers) {
    for (size_t i = 0; i < numbers.size(); ++i) {
        std::printf("%s%.4f", i == 0 ? "[" : ", ", numbers[i]);
    }
    std::printf("]");
}

int main(int count, char** arguments) {
    if (count != 4) {
        std::fprintf(stderr, "usage: measure FOLDER SECONDS THREADS\n");
        return 2;
    }
    const std::string folder = arguments[1];
    const double seconds = std::stod(arguments[2]);
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, std::stoul(arguments[3]));
    openvdb::initialize();
    const std::string about = text(folder + "/case.json");
    const std::vector<long> dims = numbers(about, "dims");
    const long column_bytes = numbers(about, "column_bytes").at(0);
    const auto positions = values<double>(folder + "/vertices.f64");
    const auto indices = values<uint32_t>(folder + "/triangles.u32");
    std::vector<openvdb::Vec3s> points;
    // Samples lie on integers; floats are what meshToVolume takes.
    for (size_t i = 0; i + 2 < positions.size(); i += 3) {
        points.emplace_back(positions[i] - 0.5, positions[i + 1] - 0.5, positions[i + 2] - 0.5);
    }
    std::vector<openvdb::Vec3I> triangles;
    for (size_t i = 0; i + 2 < indices.size(); i += 3) {
        triangles.emplace_back(indices[i], indices[i + 1], indices[i + 2]);
    }
    const auto transform = openvdb::math::Transform::createLinearTransform(1.0);
    // From here on the peak counts anew.
    std::ofstream("/proc/self/clear_refs") << "5";
    const long before = status_bytes("VmRSS:");
    std::vector<double> times, cpu_times;
    openvdb::FloatGrid::Ptr grid;
    const auto begin = Clock::now();
    do {
        const auto start = Clock::now();
        const std::clock_t cpu_start = std::clock();
        // The narrowest bands that it takes; the sign fills the inside.
        grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, points, triangles, 1.0f);
        times.push_back(ms(start));
        cpu_times.push_back(1e3 * double(std::clock() - cpu_start) / CLOCKS_PER_SEC);
    } while (times.size() < 11 && ms(begin) < seconds * 1e3);
    const long peak = status_bytes("VmHWM:");

    const auto exact = values<uint8_t>(folder + "/solid.bits");
    const auto accessor = grid->getConstAccessor();
    long missing = 0, extra = 0;
    for (long x = 0; x < dims[0]; ++x) {
        for (long y = 0; y < dims[1]; ++y) {
            const uint8_t* column = exact.data() + (x * dims[1] + y) * column_bytes;
            for (long z = 0; z < dims[2]; ++z) {
                const bool is = accessor.getValue(openvdb::Coord(x, y, z)) < 0.0f;
                const bool should = column[z / 8] >> (z % 8) & 1;
                missing += should && !is;
                extra += is && !should;
            }
        }
    }
    std::printf("{\"load_ms\": null, \"times_ms\": ");
    print(times);
    std::printf(", \"cpu_ms\": ");
    print(cpu_times);
    std::printf(", \"before_bytes\": %ld, \"peak_bytes\": %ld, \"missing\": %ld, \"extra\": %ld}\n", before, peak, missing, extra);
    return 0;
}
