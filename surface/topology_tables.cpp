#include "surface/topology_tables.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {
namespace {

using case_rule::Loop;

bool is_inside(int index, int corner) { return (index >> corner & 1) != 0; }

/// The middle of a cell's edge.
Vec3f middle_of(int edge) {
  const float i = static_cast<float>(edge & 1), j = static_cast<float>(edge >> 1 & 1);
  return edge < 4 ? Vec3f{0.5f, i, j} : edge < 8 ? Vec3f{i, 0.5f, j} : Vec3f{i, j, 0.5f};
}

float distance2(Vec3f a, Vec3f b) {
  const float x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
  return x * x + y * y + z * z;
}

/// A closed row of vertices and where they lie, roughly.
struct Ring {
  std::vector<int> vertex;
  std::vector<Vec3f> place;

  std::size_t size() const { return vertex.size(); }
};

Ring ring_of(const Loop& loop) {
  Ring ring;
  for (int i = 0; i < loop.size; ++i) {
    ring.vertex.push_back(loop.edge[static_cast<std::size_t>(i)]);
    ring.place.push_back(middle_of(ring.vertex.back()));
  }
  return ring;
}

Ring reversed(Ring ring) {
  std::reverse(ring.vertex.begin(), ring.vertex.end());
  std::reverse(ring.place.begin(), ring.place.end());
  return ring;
}

/// The three corners next to the diagonal's low end of a box around the cell's middle.
Ring neck_ring(int diagonal) {
  Ring ring;
  for (int axis = 0; axis < 3; ++axis) {
    const int corner = diagonal ^ 1 << axis;
    const auto at = [&](int i) { return corner >> i & 1 ? 0.65f : 0.35f; };
    ring.vertex.push_back(kFirstInner + axis);
    ring.place.push_back({at(0), at(1), at(2)});
  }
  return ring;
}

struct Band {
  std::vector<int> corners;  ///< of triangles
  float cost = std::numeric_limits<float>::max();
};

/// Finds the triangles between two rings that both run with the band on their left: those with the
/// shortest sides across.
class BandSearch {
 public:
  BandSearch(const Ring& p, const Ring& q) : p_(p), q_(q), used_(p.size() * q.size()) {
    for (start_ = 0; start_ < q.size(); ++start_) step(0, 0, 0);
  }

  Band best;

 private:
  std::size_t q_at(std::size_t j) const { return (start_ + 2 * q_.size() - j) % q_.size(); }

  /// Goes on from the side across after i steps along p and j steps against q.
  void step(std::size_t i, std::size_t j, float cost) {
    const std::size_t m = p_.size(), n = q_.size();
    if (cost >= best.cost) return;
    if (i == m && j == n) {
      best = {corners_, cost};
      return;
    }
    // No side across is used twice.
    const std::size_t side = i % m * n + q_at(j);
    if (used_[side]) return;
    used_[side] = true;
    const float length = distance2(p_.place[i % m], q_.place[q_at(j)]);
    if (i < m)
      add(p_.vertex[i], p_.vertex[(i + 1) % m], q_.vertex[q_at(j)], i + 1, j, cost + length);
    if (j < n)
      add(q_.vertex[q_at(j + 1)], q_.vertex[q_at(j)], p_.vertex[i % m], i, j + 1, cost + length);
    used_[side] = false;
  }

  void add(int a, int b, int c, std::size_t i, std::size_t j, float cost) {
    corners_.insert(corners_.end(), {a, b, c});
    step(i, j, cost);
    corners_.resize(corners_.size() - 3);
  }

  const Ring &p_, &q_;
  std::size_t start_ = 0;
  std::vector<bool> used_;
  std::vector<int> corners_;
};

/// Two loops joined through a neck of three vertices.
std::vector<int> tunnel_between(const Loop& a, const Loop& b, int diagonal) {
  const Ring p = ring_of(a), q = ring_of(b), neck = neck_ring(diagonal);
  Band best;
  for (const Ring& ring : {neck, reversed(neck)}) {
    const Ring other_way = reversed(ring);
    Band first = BandSearch(p, ring).best;
    const Band second = BandSearch(q, other_way).best;
    if (first.cost + second.cost >= best.cost) continue;
    first.corners.insert(first.corners.end(), second.corners.begin(), second.corners.end());
    best = {std::move(first.corners), first.cost + second.cost};
  }
  return best.corners;
}

/// A case and which of its ambiguous faces join the inside.
struct Configuration {
  int index = 0, joined = 0;

  std::vector<Loop> loops() const {
    std::vector<Loop> all;
    auto next = case_rule::successors(index, joined);
    for (int start = 0; start < 12; ++start)
      if (const Loop loop = case_rule::take_loop(next, start); loop.size > 0) all.push_back(loop);
    return all;
  }

  bool joins(int face) const { return (joined >> face & 1) != 0; }

  /// Where q changes at one end of the interval in which the columns have the signs of tunnel n:
  /// whether it has the sign of a tunnel there. `changes`: the columns that begin or end it.
  bool end_has_sign(int n, int face, const std::vector<int>& changes) const {
    const bool joins_outside = (n & 1) != 0;
    if (changes.empty()) return joins(face) == joins_outside;
    // The interval ends at the column that changes last at its beginning or first at its end. It
    // must be of the pair that the tunnel joins. A face orders each two neighbouring columns.
    return std::any_of(changes.begin(), changes.end(), [&](int own) {
      return is_own(n, own) && std::all_of(changes.begin(), changes.end(), [&](int other) {
               return is_own(n, other) || joins(face_between(own, other)) == joins_outside;
             });
    });
  }

  /// The loops that tunnel n joins, if the signs of q at the ends of its interval are those of one.
  std::optional<std::array<std::size_t, 2>> loops_of_tunnel(int n,
                                                            const std::vector<Loop>& all) const {
    std::vector<int> begin, end;
    for (int c = 0; c < 4; ++c) {
      const bool inside = n & 2 ? c == 1 || c == 2 : c == 0 || c == 3;
      const bool low = is_inside(index, c) == inside, high = is_inside(index, c + 4) == inside;
      if (!low && !high) return std::nullopt;
      if (!low) begin.push_back(c);
      if (!high) end.push_back(c);
    }
    if (!end_has_sign(n, 4, begin) || !end_has_sign(n, 5, end) || is_monotone(n))
      return std::nullopt;
    // Both roots of q lie in this interval. So q keeps its sign in that of the other pair, if the
    // cell reaches from one to the other; there tunnel n ^ 3 takes the same sign for its own.
    if (begin.size() + end.size() == 4 && (begin.empty() || end.empty()) &&
        !(end_has_sign(n ^ 3, 4, end) && end_has_sign(n ^ 3, 5, begin)))
      return std::nullopt;
    // Where the interval reaches a face, the loops pass around the pair's corners there. Else one
    // column of the pair begins the interval and the other one ends it.
    std::array<std::size_t, 2> joined_loops{};
    std::size_t count = 0;
    for (int c = 0; c < 4; ++c) {
      if (!is_own(n, c)) continue;
      const int row = c >> 1;
      const int edge = begin.empty() ? row : end.empty() ? row + 2 : 8 + c;
      joined_loops[count++] = loop_with(all, edge);
    }
    return joined_loops;
  }

 private:
  /// Whether a column is of the pair that the tunnel joins.
  static bool is_own(int n, int c) {
    const bool inside = n & 2 ? c == 1 || c == 2 : c == 0 || c == 3;
    return inside != ((n & 1) != 0);
  }
  /// How column c enters and leaves the side that it has in the interval of tunnel n: −1 it begins
  /// on the other side, 1 it ends there, 0 neither.
  int change_of(int n, int c) const {
    const bool inside = n & 2 ? c == 1 || c == 2 : c == 0 || c == 3;
    if (is_inside(index, c) != inside) return -1;
    return is_inside(index, c + 4) != inside ? 1 : 0;
  }

  /// Whether the ratio of an inside column to an outside one grows (1) or falls (−1) along the
  /// interval; 0: the case does not say. It is a quotient of linear functions, so it does either.
  int trend(int n, int in, int out) const {
    const int a = change_of(n, in), b = change_of(n, out);
    if (a != b) return b - a > 0 ? 1 : -1;
    if (a == 0) return 0;
    return joins(face_between(in, out)) == (a > 0) ? 1 : -1;
  }

  /// Whether q, by the trends of such ratios, cannot change its sign twice.
  bool is_monotone(int n) const {
    const int i = n & 2 ? 1 : 0, j = 3 - i, k = 1 - i, l = 2 + i;
    const auto same = [](int a, int b) { return a != 0 && a == b; };
    return same(trend(n, i, k), trend(n, j, l)) || same(trend(n, i, l), trend(n, j, k));
  }

  static int face_between(int a, int b) { return (a ^ b) == 1 ? 2 + (a >> 1) : a & 1; }
  static std::size_t loop_with(const std::vector<Loop>& all, int edge) {
    for (std::size_t i = 0; i < all.size(); ++i)
      for (int k = 0; k < all[i].size; ++k)
        if (all[i].edge[static_cast<std::size_t>(k)] == edge) return i;
    throw std::logic_error("no loop has this edge");
  }
};

class Builder {
 public:
  explicit Builder(TopologyTables& tables) : tables_(tables) {
    tables.patches[patches_++] = {};
    for (int index = 0; index < 256; ++index) add_case(index);
  }

 private:
  void add_case(int index) {
    const int ambiguous = case_rule::ambiguous_faces(index);
    CaseConfigurations& of_case = tables_.cases[index];
    of_case.first = static_cast<std::uint16_t>(configurations_);
    for (int f = 0; f < 6; ++f) {
      if (!(ambiguous >> f & 1)) continue;
      for (int i = 0; i < 4; ++i)
        of_case.corners[of_case.faces][i] = static_cast<std::uint8_t>(case_rule::kFaces[f][i]);
      ++of_case.faces;
    }
    of_case.needs_values = ambiguous != 0;
    // All choices of the ambiguous faces, in the order in which patch_of() counts them.
    for (int joined = 0;; joined = (joined - ambiguous) & ambiguous) {
      if (add_configuration({index, joined})) of_case.needs_values = true;
      if (joined == ambiguous) break;
    }
    of_case.consistent_patch = tables_.configurations[configurations_ - 1].patch;
  }

  /// Whether a tunnel is possible.
  bool add_configuration(const Configuration& configuration) {
    if (configurations_ == TopologyTables::kMaxConfigurations)
      throw std::logic_error("too many configurations");
    FaceConfiguration& out = tables_.configurations[configurations_++];
    const std::vector<Loop> loops = configuration.loops();
    out.patch = static_cast<std::uint16_t>(add_patch(loops, std::nullopt, -1));
    bool any = false;
    for (int n = 0; n < 4; ++n) {
      const auto joined = configuration.loops_of_tunnel(n, loops);
      if (!joined) continue;
      any = true;
      out.tunnel[n] = static_cast<std::uint16_t>(patches_);
      for (int diagonal = 0; diagonal < 4; ++diagonal) add_patch(loops, joined, diagonal);
    }
    return any;
  }

  int add_patch(const std::vector<Loop>& loops,
                const std::optional<std::array<std::size_t, 2>>& joined, int diagonal) {
    if (patches_ == TopologyTables::kMaxPatches) throw std::logic_error("too many patches");
    CellPatch& patch = tables_.patches[patches_];
    patch = {};
    patch.first = static_cast<std::uint16_t>(corners_);
    patch.diagonal = static_cast<std::int8_t>(diagonal);
    if (joined) {
      patch.inner = 3;
      add_corners(tunnel_between(loops[(*joined)[0]], loops[(*joined)[1]], diagonal));
    }
    int centres = 0;
    for (std::size_t i = 0; i < loops.size(); ++i)
      if (!joined || (i != (*joined)[0] && i != (*joined)[1])) add_disc(loops[i], patch, centres);
    const int triangles = (corners_ - patch.first) / 3;
    if (triangles > kMaxPatchTriangles || patch.inner > kMaxPatchInner)
      throw std::logic_error("a patch is too large");
    patch.triangles = static_cast<std::uint8_t>(triangles);
    return patches_++;
  }

  void add_disc(const Loop& loop, CellPatch& patch, int& centres) {
    case_rule::Corners corners{};
    int used = 0;
    if (case_rule::triangulate(loop, 0, loop.size - 1, corners, used)) {
      add_corners({corners.begin(), corners.begin() + used});
      return;
    }
    if (centres == 2) throw std::logic_error("more than two loops need an inner vertex");
    const int centre = kFirstInner + patch.inner++;
    unsigned edges = 0;
    for (int i = 0; i < loop.size; ++i) {
      const int a = loop.edge[static_cast<std::size_t>(i)];
      edges |= 1u << a;
      add_corners({a, loop.edge[static_cast<std::size_t>((i + 1) % loop.size)], centre});
    }
    patch.centre[centres++] = static_cast<std::uint16_t>(edges);
  }

  void add_corners(const std::vector<int>& corners) {
    if (corners_ + static_cast<int>(corners.size()) > TopologyTables::kMaxCorners)
      throw std::logic_error("too many corners");
    for (const int corner : corners)
      tables_.corners[corners_++] = static_cast<std::uint8_t>(corner);
  }

  TopologyTables& tables_;
  int configurations_ = 0, patches_ = 0, corners_ = 0;
};

}  // namespace

const TopologyTables& topology_tables() {
  static const std::unique_ptr<const TopologyTables> tables = [] {
    auto made = std::make_unique<TopologyTables>();
    const Builder builder(*made);
    return made;
  }();
  return *tables;
}

}  // namespace isobrick
