#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "filters/quadric.h"
#include "filters/removed_points.h"
#include "filters/triangle_group.h"

namespace isobrick::inline v0 {

/// The triangles of a vertex become another one's, by places in a group.
struct Collapse {
  std::uint32_t from = 0, to = 0;
  float error = 0;  ///< the largest so far; see EdgeCollapse

  friend bool operator==(const Collapse&, const Collapse&) = default;
};

/// Simplifies a group by collapsing its edges, those of the smallest error first: Garland &
/// Heckbert, 1997. Vertices stay where they are, and those on open sides stay altogether, so that
/// groups that share sides fit together afterwards.
///
/// The surface keeps its topology. An edge collapses where the link condition holds: Dey,
/// Edelsbrunner, Guha & Nekhayev, Topology preserving edge contraction, 1999. Sides between two
/// vertices of the group's border are never made, for another group might make the same one. No
/// triangle turns over.
///
/// The error of a collapse is a length: the root of the sum of squared distances to the planes of
/// all triangles that met there. Each has a weight of 1, or less if it is smaller than the mean.
/// So errors are about the largest distance, and those of different groups can be compared.
class EdgeCollapse {
 public:
  /// No vertex of the group, nor the centre of a triangle, ends farther than `max_distance` from
  /// the surface: world units; infinite: anywhere.
  EdgeCollapse(const TriangleGroup& group, double max_distance);

  /// Collapses edges until `least` triangles or fewer are left, or no edge can be collapsed. To be
  /// called once.
  std::vector<Collapse> run(std::size_t least);

 private:
  /// A triangle and two of its vertices, behind the third.
  struct Corners {
    std::uint32_t triangle, next, last;

    bool has(std::uint32_t vertex) const { return next == vertex || last == vertex; }
  };
  struct Candidate {
    float cost;
    std::uint32_t from;
    std::uint32_t version;

    bool operator>(const Candidate& other) const {
      return cost != other.cost ? cost > other.cost : from > other.from;
    }
  };
  struct Target {
    float cost;
    std::uint32_t to;

    bool operator<(const Target& other) const {
      return cost != other.cost ? cost < other.cost : to < other.to;
    }
  };

  /// All of a vertex, because collapses jump from one to another.
  struct Vertex {
    Vec3d position;  ///< relative to the group's first one
    Quadric quadric;
    std::size_t begin = 0;  ///< its part of `corners_`
    std::uint32_t count = 0;
    std::uint32_t version = 0;  ///< of the candidate that counts
    Target best{};              ///< what that one is for
    std::uint32_t mark = 0;     ///< scratch of keeps_topology()
    bool is_border = false;
  };
  static constexpr Target kNowhere{std::numeric_limits<float>::infinity(), ~std::uint32_t{0}};

  void find_fans(const std::vector<Triangle>& triangles);
  bool is_closed_fan(std::uint32_t vertex) const;
  void sum_planes(const std::vector<Triangle>& triangles);
  std::span<const Corners> around(std::uint32_t vertex) const {
    return {corners_.data() + vertices_[vertex].begin, vertices_[vertex].count};
  }
  float cost(std::uint32_t from, std::uint32_t to) const;
  void push(std::uint32_t from, Target target);
  void push(std::uint32_t from);
  void update(std::uint32_t from, std::uint32_t gone, std::uint32_t changed);
  /// The cheapest place for a vertex to go to.
  std::optional<Target> find_target(std::uint32_t from);
  bool may_collapse(std::uint32_t from, std::uint32_t to);
  bool keeps_topology(std::uint32_t from, std::uint32_t to);
  bool turns_over(std::uint32_t from, std::uint32_t to) const;
  bool keeps_distance(std::uint32_t from, std::uint32_t to);
  void collapse(std::uint32_t from, std::uint32_t to);
  void give_triangles(std::uint32_t from, std::uint32_t to);

  std::vector<Vertex> vertices_;
  std::vector<Corners> corners_;
  std::size_t triangles_;
  std::vector<Candidate> heap_;
  std::uint32_t last_mark_ = 0;
  std::vector<Target> targets_;           ///< scratch of find_target()
  std::optional<RemovedPoints> removed_;  ///< where there is a distance to keep
  std::vector<RemovedPoints::Patch> patches_;
  std::vector<std::uint32_t> gone_;
};

/// Which vertex each one of a group becomes by collapses; one that is in no collapse becomes
/// itself.
std::vector<std::uint32_t> final_vertices(const TriangleGroup& group,
                                          std::span<const Collapse> collapses);

/// The triangles of a group that are left after collapses, in their order.
std::vector<Triangle> collapsed(const TriangleGroup& group,
                                std::span<const std::uint32_t> final_vertices);

}  // namespace isobrick
