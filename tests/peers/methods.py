"""The peers: what a person would reach for today, each as `make(x, y, groups) -> predict`.

`x` are features (one row a sample), `y` the residual of the declared polynomial, `groups` the time block of each sample, for
choices that need samples left out. Nothing here sees a row that it is judged on.
"""
import numpy as np
import pysindy
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
KERNEL_ROWS, GP_ROWS = 120, 500


class Scaled:
    """Features to zero mean and unit spread, the target to unit spread, as the training rows have them."""

    def __init__(self, x, y):
        self.mean, self.spread = x.mean(0), np.maximum(x.std(0), 1e-12)
        self.unit = max(y.std(), 1e-12)

    def x(self, x):
        # a sample far outside of what was seen is held at four spreads: no method here can know more
        return np.clip((x - self.mean) / self.spread, -4, 4)


class Sindy:
    """Sequentially thresholded least squares over all products of two features; the threshold by blocks left out."""

    def __init__(self, x, y, groups, names):
        self.scale = Scaled(x, y)
        self.library = pysindy.PolynomialLibrary(degree=2).fit(self.scale.x(x))
        terms, target = self.terms(x), y / self.scale.unit
        errors = []
        for threshold in THRESHOLDS:
            squares = 0.0
            for g in np.unique(groups):
                seen = groups != g
                if seen.all() or seen.sum() < 20:
                    continue
                squares += ((target[~seen] - terms[~seen] @ self.fit(terms[seen], target[seen], threshold)) ** 2).sum()
            errors.append(squares)
        # no term at all is a choice like the others
        best = int(np.argmin(errors))
        nothing = (target**2).sum()
        self.weights = np.zeros(terms.shape[1]) if nothing <= errors[best] else self.fit(terms, target, THRESHOLDS[best])
        self.named = [n for n, w in zip(self.library.get_feature_names(names), self.weights) if w != 0]

    @staticmethod
    def fit(terms, target, threshold):
        model = pysindy.STLSQ(threshold=threshold, alpha=1e-3)
        model.fit(terms, target.reshape(-1, 1))
        return np.ravel(model.coef_)

    def terms(self, x):
        return np.asarray(self.library.transform(self.scale.x(x)))

    def predict(self, x):
        return self.scale.unit * self.terms(x) @ self.weights


class Process:
    """A Gaussian process, one length a feature; kernel by the likelihood of a thinned set, prediction from a denser one."""

    def __init__(self, x, y, groups, names):
        self.scale = Scaled(x, y)
        thin = lambda most: np.linspace(0, len(y) - 1, min(most, len(y))).astype(int)
        kernel = ConstantKernel(1.0) * RBF(np.ones(x.shape[1]), (0.05, 1e4)) + WhiteKernel(0.1, (1e-6, 1e1))
        few, more = thin(KERNEL_ROWS), thin(GP_ROWS)
        z = self.scale.x(x)
        first = GaussianProcessRegressor(kernel, normalize_y=True, random_state=1).fit(z[few], y[few])
        self.model = GaussianProcessRegressor(first.kernel_, optimizer=None, normalize_y=True).fit(z[more], y[more])

    def predict(self, x):
        return self.model.predict(self.scale.x(x))


class Boosting:
    """Histogram gradient boosting, scikit-learn's defaults but for a slower rate and larger leaves (neighbours share noise)."""

    def __init__(self, x, y, groups, names):
        self.model = HistGradientBoostingRegressor(learning_rate=0.05, max_iter=150, min_samples_leaf=40, random_state=1).fit(x, y)

    def predict(self, x):
        return self.model.predict(x)


PEERS = {"pysindy": Sindy, "gaussian process": Process, "gradient boosting": Boosting}
