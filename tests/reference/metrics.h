// The measures of flat/metrics, written plainly in double precision, one pixel after the other.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

namespace fathom::reference {

struct Picture {
  int width = 0, height = 0;
  std::vector<double> values[3];  // R, G, B
};

// The mean of term(a, r) over all values.
inline double meanOf(const Picture& a, const Picture& r, const std::function<double(double, double)>& term) {
  double sum = 0;
  for (int c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.values[c].size(); ++i) sum += term(a.values[c][i], r.values[c][i]);
  return sum / double(3 * a.values[0].size());
}

inline double relMse(const Picture& a, const Picture& r) {
  return meanOf(a, r, [](double x, double y) { return (x - y) * (x - y) / (y * y + 0.01); });
}

inline double smape(const Picture& a, const Picture& r) {
  return meanOf(a, r, [](double x, double y) { return std::fabs(x - y) / (std::fabs(x) + std::fabs(y) + 0.01); });
}

inline double toneMap(double x) {
  if (x <= 0) return 0;
  const double y = x / (1 + x);
  return y <= 0.0031308 ? 12.92 * y : 1.055 * std::pow(y, 1 / 2.4) - 0.055;
}

inline double luminance(const Picture& p, int x, int y) {
  const size_t i = size_t(y) * size_t(p.width) + size_t(x);
  return 0.2126 * toneMap(p.values[0][i]) + 0.7152 * toneMap(p.values[1][i]) + 0.0722 * toneMap(p.values[2][i]);
}

// SSIM of one whole window of 11 x 11 pixels: weighted mean first, then weighted central moments.
inline double ssimOfWindow(const Picture& a, const Picture& r, int x, int y) {
  double weight = 0, ma = 0, mr = 0, va = 0, vr = 0, cov = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (int dy = -5; dy <= 5; ++dy)
      for (int dx = -5; dx <= 5; ++dx) {
        const double w = std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5));
        const double la = luminance(a, x + dx, y + dy), lr = luminance(r, x + dx, y + dy);
        if (pass == 0) {
          weight += w, ma += w * la, mr += w * lr;
        } else {
          va += w * (la - ma) * (la - ma), vr += w * (lr - mr) * (lr - mr), cov += w * (la - ma) * (lr - mr);
        }
        if (pass == 0 && dx == 5 && dy == 5) ma /= weight, mr /= weight;
      }
  const double c1 = 0.0001, c2 = 0.0009;
  return (2 * ma * mr + c1) * (2 * cov / weight + c2) / ((ma * ma + mr * mr + c1) * ((va + vr) / weight + c2));
}

inline double ssim(const Picture& a, const Picture& r) {
  double sum = 0;
  for (int y = 5; y < a.height - 5; ++y)
    for (int x = 5; x < a.width - 5; ++x) sum += ssimOfWindow(a, r, x, y);
  return sum / ((a.width - 10) * (a.height - 10));
}

}  // namespace fathom::reference
