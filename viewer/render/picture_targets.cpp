#include "viewer/render/picture_targets.h"

#include <epoxy/gl.h>

#include <array>
#include <vector>

namespace isobrick::inline v0 {

PictureResult::PictureResult(int picture_width, int picture_height, bool with_ids)
    : width(picture_width), height(picture_height), ids(with_ids) {
  const auto texture = [&](unsigned format) {
    return make_texture(format, width, height, 1, "memory for the picture");
  };
  near_depth = texture(GL_R32F);
  near_normal = texture(GL_RG16F);
  std::vector<unsigned> each{near_depth.get(), near_normal.get()};
  if (ids) {
    near_id = texture(GL_R32UI);
    each.push_back(near_id.get());
  }
  nearest = make_framebuffer(each, 0, "the nearest samples");
  picture = texture(GL_RGBA8);
  picture_target = make_framebuffer(std::array{picture.get()}, 0, "the picture");
}

PictureTargets::PictureTargets(int picture_width, int picture_height, int sample_count,
                               bool with_ids)
    : width(picture_width), height(picture_height), samples(sample_count), ids(with_ids) {
  const auto texture = [&](unsigned format, int count) {
    return make_texture(format, width, height, count, "memory for the picture");
  };
  colour = texture(GL_RGBA16F, samples);
  normal = texture(GL_RG16F, samples);
  depth = texture(GL_DEPTH_COMPONENT32F, samples);
  std::vector<unsigned> each{colour.get(), normal.get()};
  if (ids) {
    id = texture(GL_R32UI, samples);
    each.push_back(id.get());
  }
  opaque = make_framebuffer(each, depth.get(), "the picture of opaque meshes");
  if (samples > 1) find_samples();

  openness = texture(GL_R8, 1);
  openness_rows = texture(GL_R8, 1);
  openness_target = make_framebuffer(std::array{openness.get()}, 0, "the occlusion");
  openness_rows_target = make_framebuffer(std::array{openness_rows.get()}, 0, "the occlusion");
}

void PictureTargets::find_samples() {
  glBindFramebuffer(GL_FRAMEBUFFER, opaque.get());
  for (int i = 0; i < samples; ++i) {
    std::array<float, 2> place{};
    glGetMultisamplefv(GL_SAMPLE_POSITION, static_cast<GLuint>(i), place.data());
    samples_x[i] = place[0] - 0.5f;
    samples_y[i] = place[1] - 0.5f;
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  check_gl("where samples lie");
}

void PictureTargets::add_transparent() {
  if (transparent) return;
  sum = make_texture(GL_RGBA16F, width, height, samples, "memory for transparency");
  transmittance = make_texture(GL_R16F, width, height, samples, "memory for transparency");
  if (ids) front = make_texture(GL_R32UI, width, height, 1, "memory for transparency");
  transparent =
      make_framebuffer(std::array{sum.get(), transmittance.get()}, depth.get(), "transparency");
}

void PictureResult::take_front(const GlTexture& drawn) {
  if (!front) front = make_texture(GL_R32UI, width, height, 1, "memory for transparency");
  glMemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);
  glCopyImageSubData(drawn.get(), GL_TEXTURE_2D, 0, 0, 0, 0, front.get(), GL_TEXTURE_2D, 0, 0, 0, 0,
                     width, height, 1);
  has_front = true;
}

std::uint64_t PictureTargets::bytes(int width, int height, int samples, bool ids,
                                    bool transparent) {
  const std::uint64_t sample = 8 + 4 + 4 + (ids ? 4 : 0) + (transparent ? 8 + 2 : 0);
  const std::uint64_t pixel = 4 + 4 + (ids ? 4 : 0) + (ids && transparent ? 8 : 0) + 1 + 1 + 4;
  return static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) *
         (sample * static_cast<std::uint64_t>(samples) + pixel);
}

}  // namespace isobrick
