// Where the columns (or the rows) of an image come from when it is moved and scaled.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace fathom::deep {

// Half-open, of columns or rows.
struct Extent {
  int begin, end;

  bool operator==(const Extent&) const = default;
};

// A position x of the source lands on to + (x - from) * den / num. Column i covers [i, i + 1). num and den are positive;
// two numbers, so that the sizes of two images divide without an error.
struct AxisMap {
  double from = 0, to = 0, num = 1, den = 1;

  double source(double x) const { return from + (x - to) * num / den; }
  double result(double x) const { return to + (x - from) * den / num; }
  // Whether columns move by whole numbers and keep their size; then, by how many.
  bool isWholeMove() const;
  int move() const { return int(result(0)); }
  // Whether each column of the result lies within one of the source: copies are enough.
  bool copies() const;
};

// The columns of the result on which a source lies; none for none. Throws Error beyond a billion.
Extent resultOf(const AxisMap& map, Extent source);

enum class Filter {
  Box,      // by the area that is covered; a source ends at its edge, so columns on it may be covered in part
  Bilinear  // a tent over two columns, or over two of the result's where it shrinks; edges keep their strength
};

// The source's columns that some of the result's are made of, which may lie outside of the source.
Extent neededBy(const AxisMap& map, Filter filter, Extent result);

// For each column of the result, the source's columns and how much each contributes: weights of at least 1e-9, whose
// sum is what of the column lies inside of the source.
class Cover {
 public:
  Cover(const AxisMap& map, Filter filter, Extent source, Extent result);

  // The source's column that the first weight is for.
  int first(int column) const { return spans_[size_t(column - begin_)].first; }
  std::span<const double> weights(int column) const;

 private:
  struct Span {
    int first;
    uint32_t weights, count;
  };
  int begin_;
  std::vector<Span> spans_;
  std::vector<double> weights_;
};

}  // namespace fathom::deep
