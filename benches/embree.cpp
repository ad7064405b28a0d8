// Traces the rays of benches/rays.rs with Embree, one at a time, in robust mode, on one thread.
//   c++ -O3 -march=native benches/embree.cpp -lembree3 -o embree_rays        (Debian: libembree-dev)
//   embree_rays FILE    for each line on the input: CPU seconds of one pass over all rays, on the output
// FILE, little-endian: number of vertices, triangles and rays (u32); vertices (3 f32 each); triangles (3 u32 each);
// rays (origin, direction, length: 7 f32 each). The lengths that the first pass finds go to FILE.t (f32, infinity for
// none).
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <embree3/rtcore.h>

template <class T> static std::vector<T> numbers(std::ifstream &file, size_t count) {
  std::vector<T> read(count);
  file.read(reinterpret_cast<char *>(read.data()), static_cast<std::streamsize>(count * sizeof(T)));
  return read;
}

static double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

int main(int count, char **words) {
  if (count != 2) {
    std::fprintf(stderr, "usage: embree_rays FILE\n");
    return 2;
  }
  std::ifstream file(words[1], std::ios::binary);
  const auto sizes = numbers<uint32_t>(file, 3);
  const auto vertices = numbers<float>(file, 3 * size_t(sizes[0]));
  const auto triangles = numbers<uint32_t>(file, 3 * size_t(sizes[1]));
  const auto rays = numbers<float>(file, 7 * size_t(sizes[2]));
  if (!file) {
    std::fprintf(stderr, "embree_rays: %s is no file of rays\n", words[1]);
    return 2;
  }
  RTCDevice device = rtcNewDevice("threads=1");
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto *to = static_cast<float *>(rtcSetNewGeometryBuffer(
      mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), sizes[0]));
  std::copy(vertices.begin(), vertices.end(), to);
  auto *corners = static_cast<uint32_t *>(rtcSetNewGeometryBuffer(
      mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), sizes[1]));
  std::copy(triangles.begin(), triangles.end(), corners);
  rtcCommitGeometry(mesh);
  rtcAttachGeometry(scene, mesh);
  rtcCommitScene(scene);
  if (rtcGetDeviceError(device) != RTC_ERROR_NONE) {
    std::fprintf(stderr, "embree_rays: Embree reports an error\n");
    return 1;
  }

  std::vector<float> lengths(sizes[2]);
  bool first = true;
  for (int c; (c = std::getchar()) != EOF;) {
    if (c != '\n')
      continue;
    const double start = cpu_seconds();
    for (uint32_t i = 0; i < sizes[2]; i++) {
      const float *r = &rays[7 * size_t(i)];
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRayHit ray = {};
      ray.ray.org_x = r[0], ray.ray.org_y = r[1], ray.ray.org_z = r[2];
      ray.ray.dir_x = r[3], ray.ray.dir_y = r[4], ray.ray.dir_z = r[5];
      ray.ray.tfar = r[6], ray.ray.mask = ~0u;
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene, &context, &ray);
      const bool is_hit = ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      lengths[i] = is_hit ? ray.ray.tfar : std::numeric_limits<float>::infinity();
    }
    std::printf("%.9f\n", cpu_seconds() - start);
    std::fflush(stdout);
    if (first) {
      std::ofstream(std::string(words[1]) + ".t", std::ios::binary)
          .write(reinterpret_cast<const char *>(lengths.data()), static_cast<std::streamsize>(4 * lengths.size()));
      first = false;
    }
  }
}
